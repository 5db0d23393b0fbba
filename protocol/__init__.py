"""Designs, plans, the session state machine, the participant ledger, questionnaires.

Also the contract of simulated participants.
"""
