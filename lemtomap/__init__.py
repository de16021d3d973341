"""LEMTOMap: samples in, a rolling window under a relative topological map, a velocity out.

Pure: no clock, thread, task, socket or serial port; time and random generators are arguments.
"""
