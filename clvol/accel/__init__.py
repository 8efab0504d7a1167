"""Acceleration structures, built as pure NumPy functions from arrays to arrays.

Majorant grids, kd-trees and the surfaces' bounding volume hierarchy live here; nothing here touches OpenCL.
"""
