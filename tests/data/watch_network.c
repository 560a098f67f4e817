/* Preloaded into a process under test: writes every attempt to reach a network into $WATCH_NETWORK_LOG and refuses it. */
#include <errno.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/socket.h>

static void note(const char* what) {
    const char* path = getenv("WATCH_NETWORK_LOG");
    FILE* log = path ? fopen(path, "a") : NULL;
    if (!log) {
        return;
    }
    fprintf(log, "%s\n", what);
    fclose(log);
}

int socket(int domain, int type, int protocol) {
    (void)domain, (void)type, (void)protocol;
    note("socket");
    errno = EACCES;
    return -1;
}

int getaddrinfo(const char* node, const char* service, const struct addrinfo* hints, struct addrinfo** found) {
    (void)service, (void)hints, (void)found;
    note(node ? node : "getaddrinfo");
    return EAI_FAIL;
}
