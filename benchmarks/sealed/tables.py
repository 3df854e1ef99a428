def tables(x):
    return ""
