"""Studies in rooms: each draws a figure and writes its series and its numbers; scenes they share are in `scenes`."""
