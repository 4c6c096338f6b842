# `cargo sim` is an alias, so cargo's completion is asked about it. Behind it, this one answers as well.
function __isofeed_is_sim
    set -l words (commandline -opc)
    string match -q -- '+*' "$words[2]"; and set -e words[2]
    test (count $words) -ge 2; and test "$words[2]" = sim
end
function __isofeed_complete
    set -l words (commandline -opc)
    string match -q -- '+*' "$words[2]"; and set -e words[2]
    set -e words[1..2]
    complete -C "cargo_sim "(string join ' ' -- (string escape -- $words) (commandline -ct))
end
complete -c cargo -n __isofeed_is_sim -f -a '(__isofeed_complete)'
