"""An OpenCL device: its memory, its programs, and the folder in which PoCL keeps them."""
