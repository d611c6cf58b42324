"""Studies: one file a question. Each draws a figure and writes its series and its numbers."""
