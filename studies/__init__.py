"""Study files: plain Python that states STUDY, run by ``colloc sweep``."""
