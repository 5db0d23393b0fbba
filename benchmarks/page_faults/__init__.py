"""Kill the server of a study on a page, kill its browser, cut its network; count what is lost."""
