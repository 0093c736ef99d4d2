"""The rooms of the page, in the order of the work; each is a door to some of what the package computes."""
