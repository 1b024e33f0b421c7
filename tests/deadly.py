"""Work that kills the process it is done in, once; imported by worker processes, so nothing else is in here."""

import os


def square(number):
    if number == 3:
        os._exit(3)
    return number * number
