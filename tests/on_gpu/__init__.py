"""All checks that need a GPU, in one command: ``python -m tests.on_gpu``, see ``__main__``."""
