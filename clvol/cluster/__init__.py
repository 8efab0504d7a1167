"""One picture by many devices or machines: ranges of samples are dealt out, and their sums added.

Who renders a range is nobody's business here but `devices.py`'s (this machine's) and `dask.py`'s (a
cluster's); the picture's bits do not depend on it.
"""
