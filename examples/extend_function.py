"""A function as an observer: called with the initial state and after every accepted step."""

history = []


def note_the_middle(time, state):
    """Time [s] and pore pressure [N/mm²] in the middle of the column."""
    history.append((time, state.at((0.25,), "p")))
