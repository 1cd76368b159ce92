"""What a browser loads of the live page: files as they are, without Python.

`uplot.*` are those of uPlot 1.6.32 (https://github.com/leeoniya/uPlot, package `uplot` of npm), MIT: `uplot.LICENSE`.
"""
