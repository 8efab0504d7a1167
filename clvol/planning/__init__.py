"""What is done for a scene: the registry of choices, the scene's features, the kernels that follow.

Pure: no device, no table of a scene's values.
"""
