"""The same results without motorprime, as fast as NumPy, OpenCV and ONNX Runtime can be made to give them.

Every peer keeps its buffers from call to call, works in place and in float32 where that is exact enough, and
leaves out the checks of the input that the kernels make.
"""
