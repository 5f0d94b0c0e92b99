"""An audit becomes something to read: the command line, and the report."""
