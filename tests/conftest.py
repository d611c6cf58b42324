"""Settings of every test."""

import os

os.environ.setdefault("NGS_NUM_THREADS", "1")  # before ngsolve is imported: the scenes are too small for threads to pay
