"""One Processing algorithm a file; each calls what the command of the same name calls."""
