"""What a browser loads of the live page: files as they are, without Python. `uplot.*` is uPlot 1.6.32 (npm), MIT: `uplot.LICENSE`."""
