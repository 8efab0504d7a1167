"""From a scene's records to arrays as the device has them.

Volumes, majorants, surfaces, media, materials, lights, camera, filter.  Pure NumPy.
"""
