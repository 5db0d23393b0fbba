"""What a session will do, as data made before anything runs: designs, orders, steps, trials,
questionnaires. Nothing here performs, measures or knows of devices.
"""
