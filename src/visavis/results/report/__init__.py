"""The report of a study as one page: findings, methods, the reporting list, and what it cites."""
