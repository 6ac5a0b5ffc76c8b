"""Commands: the table of them, what they do, their keys, and the menus."""
