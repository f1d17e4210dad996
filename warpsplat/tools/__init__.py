"""Commands about the program itself: timings, a comparison with another program, a self-test."""
