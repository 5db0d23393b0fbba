"""Waving at whom? Is a wave understood better when it is warped to be seen?"""
