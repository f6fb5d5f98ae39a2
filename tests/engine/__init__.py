"""The diagnosis' arithmetic against closed forms, on linear models that stand in for machines."""
