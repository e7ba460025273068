"""Training methods: DP, SIP, HIG and supervised regression."""
