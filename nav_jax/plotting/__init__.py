"""The figures, one file a room: every figure is a function that takes a result and gives a matplotlib `Figure`."""
