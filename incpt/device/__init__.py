"""The OpenCL device: choosing it, building kernels, moving memory."""
