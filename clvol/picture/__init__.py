"""Pictures: what a film's sums estimate, results, and their files.  Knows no device."""
