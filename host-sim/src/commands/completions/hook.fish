# `cargo sim` is a cargo alias, so fish calls cargo's completion for it. This completion is added to it.
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
