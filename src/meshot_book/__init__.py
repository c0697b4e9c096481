"""What only the book needs: figures, players, exercises, verdict rules, the ledger.

The book imports the library ``meshot``; the library never imports the book.
"""
