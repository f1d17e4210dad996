"""The library: what ``import warpsplat`` offers, and what the commands are made of; a file a function, or a
subject.

Nothing is printed and no file is written unless asked for. Functions may be called from several threads: on a
CPU they run side by side, on a GPU one after the other. Warp starts with the first call.
"""
