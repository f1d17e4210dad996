"""Several fits for one result: a PSNR, a size or a number of shapes is reached by trying."""
