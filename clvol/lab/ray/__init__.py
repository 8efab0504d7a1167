"""The teaching view: what techniques do along one camera ray, by the same device functions as in renders.

`trace` has `clvol.trace_ray`; `place` finds the ray and what lies on it, `kernels` runs walks on the device,
`walks` reads what they recorded, `watched` holds it, `plot` draws it (`walks_panel`, `estimates`), and `view`
is what a user has in hand.
"""
