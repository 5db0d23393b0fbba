"""Motion made from a few poses, examples or learnt phrases, as the source papers make it."""
