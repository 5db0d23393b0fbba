"""Reference results and the runners that compare with them."""
