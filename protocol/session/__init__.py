"""A plan performed for one participant: state machine, frame loop, trial runner, devices watched,
questions asked, the operator's controls. What is to be performed is data of `protocol.plan`.
"""
