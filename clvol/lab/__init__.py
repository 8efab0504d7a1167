"""Measuring by rendering: which choice is right, and which is cheapest, on a scene.

`trials` renders combinations of choices by turns, with `seeds` that are independent.  `statistics` has the
numbers that all share; `agreement` says whether pictures agree, `efficiency` how much cheaper one is: pure
functions on arrays.  `selftest` judges the choices of a scene against each other (`judgement`, `verdict`),
`pilot` picks the cheapest (`candidates`).  `clvol.lab.comparison`, which writes reports, and `clvol.lab.ray`,
which shows single walks, build on these.
"""
