"""`clvol.render` and what goes with it: a caller's wishes are checked, then a session renders.

Everything below works on records and plans; here alone all of a render comes together.
"""
