"""The reconstruction as an HTTP endpoint, for other programs (`sketchcore serve`).

views       cameras as requests say them
order       what a request asks for, and the file that is made of it
service     how many requests are served at a time, how many wait, and for how long
api         the routes and what they promise (OpenAPI)
launch      where it listens and how it ends
"""
