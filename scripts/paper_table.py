def table(work): return ""
