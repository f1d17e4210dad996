"""Pages that people look at: templates, style and scripts, put together to one file that needs nothing else.

Nothing here computes: what a page shows comes as texts, numbers and data URIs.
"""

from warpsplat.pages.environment import MARK, page

__all__ = ["MARK", "page"]
