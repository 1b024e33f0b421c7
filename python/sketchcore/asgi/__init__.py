"""What both servers, the app and `sketchcore serve`, answer by; it needs FastAPI and no NiceGUI.

guard       who is let in, and how much a request may be
sentences   errors as {"error": sentence}
files       solids as files to save
address     where a server listens, and whom that lets in
"""
