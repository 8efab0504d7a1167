"""One scene on one device: buffers, waves of kernels, the film, and the session that runs them."""
