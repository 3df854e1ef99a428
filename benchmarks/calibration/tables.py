"""Tables."""
def tables(results):
    return ""
