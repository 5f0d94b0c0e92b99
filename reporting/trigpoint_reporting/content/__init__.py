"""What the report's sections say: each a function from the evidence to blocks."""
