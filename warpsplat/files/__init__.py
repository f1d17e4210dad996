"""Reading what a user names, writing what was made."""
