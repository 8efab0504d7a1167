"""Acceleration structures, built as pure NumPy functions from arrays to arrays.

Majorant grids and kd-trees live here (bounding volume hierarchies will); nothing here touches OpenCL.
"""
