"""The live page of a run: what stands (`hub`), who may ask for it (`gate`), how it is sent (`server`). Only `bench.cli` imports
it.

Nothing in here may block, delay or raise in the run's thread: the run appends to bounded boxes and never waits, everything else
is done by the publisher's thread, and each client has a thread of its own.
"""
