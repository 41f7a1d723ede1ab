"""Study files: plain Python that states STUDY, run by ``python -m colloc.commands.sweep``."""
