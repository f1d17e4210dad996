"""Example batch files."""
