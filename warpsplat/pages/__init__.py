"""Pages: templates, styles and scripts are rendered into one self-contained file.

Nothing here computes results: pages get texts, numbers and data URIs.
"""
