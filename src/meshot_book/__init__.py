"""Code that only the book needs: figures, interactive players, exercises, rules of verdicts, the ledger.

The book imports the library ``meshot``; the library never imports the book.
"""
