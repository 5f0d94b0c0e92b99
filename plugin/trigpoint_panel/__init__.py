"""The desktop panel for picking and review."""
