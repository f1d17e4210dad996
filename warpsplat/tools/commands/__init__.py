"""Commands about the program itself, one file each."""
