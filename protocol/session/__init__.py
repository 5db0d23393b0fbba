"""A plan performed for one participant: state machine, frame loop, trial runner, devices watched,
questions asked, the operator's controls. The plan itself is data of `protocol.plan`.
"""
