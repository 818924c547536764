#!/usr/bin/perl
# A solver that speaks henon_ref's protocol, in Perl: Runge-Kutta steps of one length, events by bisection.
use strict;
use warnings;
use JSON::PP;
use POSIX qw(tan asin acos atan sinh cosh tanh pow);
use Time::HiRes qw(clock_gettime CLOCK_MONOTONIC);

my $request = decode_json(do { local $/; <STDIN> });
my $problem = $request->{problem};
die "this program speaks version 1\n" if $request->{protocol} != 1;

# Texts as one function of t and a state that gives a list: names become variables, functions are Perl's.
my %variable = map { $problem->{states}[$_] => "\$_[1][$_]" } 0 .. $#{ $problem->{states} };
$variable{$_} = "(" . sprintf("%.17g", $problem->{parameters}{$_}) . ")" for keys %{ $problem->{parameters} };
$variable{t} = '$_[0]';

my %made;

sub made {
    my $key = "@_";
    return $made{$key} if $made{$key};
    my $texts = join ", ", map { my $text = $_; $text =~ s/(?<![\w.])([A-Za-z]\w*)/$variable{$1} \/\/ $1/ge; $text } @_;
    return $made{$key} = eval("sub { ($texts) }") || die "cannot read $texts: $@";
}

my %modes = map { $_->{mode} => { given => $_, field => made(@{ $_->{field} }),
    guards => made(map { $_->{expression} } @{ $_->{guards} }) } } @{ $problem->{modes} };
my ($surface, $gradient) = (made($problem->{surface}{expression}), made(@{ $problem->{surface}{gradient} }));

sub moved { my ($x, $h, $k) = @_; return [map { $x->[$_] + $h * $k->[$_] } 0 .. $#$x] }

sub rk4 {
    my ($f, $t, $x, $h) = @_;
    my $k1 = [$f->($t, $x)];
    my $k2 = [$f->($t + $h / 2, moved($x, $h / 2, $k1))];
    my $k3 = [$f->($t + $h / 2, moved($x, $h / 2, $k2))];
    my $k4 = [$f->($t + $h, moved($x, $h, $k3))];
    return moved($x, $h / 6, [map { $k1->[$_] + 2 * $k2->[$_] + 2 * $k3->[$_] + $k4->[$_] } 0 .. $#$x]);
}

# Numbers of the guards that were positive and are so no more.
sub fallen { my ($before, $after) = @_; return grep { $before->[$_] > 0 && !($after->[$_] > 0) } 0 .. $#$before }

# The mode that follows a guard, or the status that the run ends with.
sub follower {
    my ($guard, $t, $x) = @_;
    for my $next (@{ $guard->{successors} }) {
        next if grep { !($_ >= 0) } made(@{ $next->{when} })->($t, $x);
        return defined $next->{mode} ? ($next->{mode}, undef) : (undef, $next->{ends});
    }
    return (undef, "failed");
}

sub run {
    my ($t, $x, $side) = @{ $problem->{start} }{qw(time state mode)};
    my ($until, @events) = ($problem->{until});
    my $longest = ($until - $t) * 0.2 * $request->{rtol}**0.25;
    my ($status, $steps) = ("ok", 0);
    my @before = $modes{$side}{guards}->($t, $x);
    while ($t < $until) {
        my $mode = $modes{$side} or return ("failed", $t, $x, $side, $steps, \@events);
        my $h = $t + $longest < $until ? $longest : $until - $t;
        my $after = rk4($mode->{field}, $t, $x, $h);
        my @values = $mode->{guards}->($t + $h, $after);
        $steps++;
        if (!fallen(\@before, \@values)) {
            ($t, $x, @before) = ($h < $longest ? $until : $t + $h, $after, @values);
            next;
        }
        my ($early, $late) = (0, $h);
        for (1 .. 60) {
            my $middle = ($early + $late) / 2;
            my @there = $mode->{guards}->($t + $middle, rk4($mode->{field}, $t, $x, $middle));
            fallen(\@before, \@there) ? ($late = $middle) : ($early = $middle);
        }
        $after = rk4($mode->{field}, $t, $x, $late);
        my ($guard) = fallen(\@before, [$mode->{guards}->($t + $late, $after)]);
        ($t, $x) = ($t + $late, $after);
        if ($mode->{given}{guards}[$guard]{kind} ne "valid") {    # put the state on the surface
            my ($distance, @slope) = ($surface->($t, $x), $gradient->($t, $x));
            my $square = 0;
            $square += $_**2 for @slope;
            $x = moved($x, -$distance / $square, \@slope) if $square > 0;
        }
        my ($next, $ends) = follower($mode->{given}{guards}[$guard], $t, $x);
        return ($ends, $t, $x, $side, $steps, \@events) if defined $ends;
        push @events, [$t, $side, $next, $x];
        return ("failed", $t, $x, $next, $steps, \@events) if @events >= $request->{most_transitions};
        $side = $next;
        @before = $modes{$side} ? $modes{$side}{guards}->($t, $x) : ();
    }
    return ($status, $t, $x, $side, $steps, \@events);
}

my (@times, @found);
for my $number (1 - $request->{untimed} .. $request->{timed}) {
    my $began = clock_gettime(CLOCK_MONOTONIC);
    @found = run();
    push @times, clock_gettime(CLOCK_MONOTONIC) - $began if $number > 0;
}

sub numbers { return "[" . join(",", map { sprintf "%.17g", $_ } @_) . "]" }

my ($status, $t, $x, $side, $steps, $events) = @found;
my $listed = join ",", map { sprintf '{"time":%.17g,"before":%d,"after":%d,"state":%s}', @$_[0 .. 2], numbers(@{ $_->[3] }) } @$events;
printf '{"protocol":1,"program":{"name":"minimal.pl","version":"Perl %vd"},"status":"%s","reason":"%s",', $^V, $status,
    $status eq "ok" ? "" : "it ended there";
printf '"transitions":[%s],"end":{"time":%.17g,"state":%s,"mode":%d},', $listed, $t, numbers(@$x), $side;
printf '"wall_s":%s,"work":{"steps":%d}}' . "\n", numbers(@times), $steps;
