"""The command `clvol`: one file for each of its commands."""
