"""`python -m visavis` is the command `visavis`, where its script is not on the path."""

from visavis.cli.main import main

if __name__ == "__main__":
    main()
