"""Names as an attacker or an accident makes them: of channels, files and materials."""

NAMES = (
    "R*/int evil(void){return 42;}/*",
    "//*/ int evil; /*",
    "ends in a backslash \\",
    "two\nlines\r\nfloat evil;\u2028float evil;",
    "a\0zero",
    "\x1b[31mred\x1b]0;title\x07",
    "\u202egnp.exe\u2066",
    "</script><img src=x onerror=alert(1)>",
    "{{script}} %s {0} ${x}",
    "[/] [bold]x[/bold] :smile:",
    "| a | *b* `c` [d](javascript:e) <f>",
    "lone \ud800 surrogate",
    "\U000e0001tagged",
    "x" * 3000,
)
# What no generated text may hold, whatever a name holds: control, bidirectional, and what UTF-8 cannot write.
FORBIDDEN = "\0\x07\x1b\u2028\u202e\u2066\ud800\U000e0001"
