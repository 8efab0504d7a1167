"""What every room uses: checked arguments, files, memory, signals, progress.  Imports errors alone."""
